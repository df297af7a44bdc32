"""``nanobench VERB``: one file per verb, loaded when it is called; every error is one line.

Exit codes: 0 done; 1 done, but items failed (listed); 2 bad usage or input; 130 interrupted, resumable.
"""

import difflib
import importlib
import os
import sys
import traceback
import warnings
from typing import TextIO

import click

from ..errors import NanobenchError
from ..lookup.deprecation import todays_options
from ..lookup.user_folder import ours_first
from ..version import __version__

VERBS: dict[str, tuple[str, str]] = {
    "run": ("The main job: audit, the three tasks and the report.", "nanobench run --out results"),
    "audit": ("Find the faults of recordings and the spans that are clean.",
              "nanobench audit FLIGHTS --json audit.json"),
    "estimate": ("Task 3: where was it? Scores of state estimators.", "nanobench estimate --protocol as-published"),
    "sysid": ("Task 1: what will it do? Scores of predictive models.", "nanobench sysid --json sysid.json"),
    "thrust": ("Thrust from PWM and voltage: stand tables and flights.",
               "nanobench thrust STAND --out DIR"),
    "motors": ("Motor lag, speed and torque from logs with measured RPM.",
               "nanobench motors LOGS --mass 0.037 --out DIR"),
    "noise": ("Noise of gyro and accelerometer, at rest and in flight.",
              "nanobench noise FLIGHTS --out DIR"),
    "control": ("Task 2: how well was it flown? Scores of controllers.", "nanobench control --plant real"),
    "tune": ("Search gains; judge them on plants and paths left out.",
             "nanobench tune --controller geometric --budget 60 --out tuned"),
    "diagnose": ("Where is my simulator wrong? What, how big, how sure.",
                 "nanobench diagnose FLIGHTS --simulator simulator.toml --out DIR"),
    "prove": ("Blind cases for diagnose: sealed, diagnosed, opened, scored.",
              "nanobench prove --cases 200 --out proof"),
    "sample": ("Write the three sample flights of the package (SYNTHETIC).", "nanobench sample --out sample"),
    "simulate": ("Write practice flights through the whole logging chain.",
                 "nanobench simulate --flights 20 --out practice"),
    "fly": ("Fly a real or simulated Crazyflie, under safety rules.",
            "nanobench fly --controller geometric --speed 1.0 --dry-run"),
    "stop": ("Stop the motors of a vehicle at once, from another terminal.",
             "nanobench stop radio://0/80/2M/E7E7E7E7E7"),
    "record": ("Record a vehicle over its link, packet by packet.",
               "nanobench record --uri URI --seconds 10 --out flights"),
    "convert": ("Recordings or a simulator.toml into another format.",
                "nanobench convert LOGS --to parquet --out DIR"),
    "new": ("A method of your own to begin with, with its test.", "nanobench new estimator my_estimator"),
    "columns": ("Draft a column map for a table of your own.", "nanobench columns FILE --out columns.toml"),
    "sources": ("Formats that are read, and what each is good for.", "nanobench sources"),
    "settings": ("Numbers set by looking at data, and what they were set on.", "nanobench settings audit"),
    "report": ("One HTML page from the result files of a folder.", "nanobench report --out results"),
}
"""Verb -> one line of help, an example. Help is printed from here, so that no verb is loaded for it."""

FIRST = ("run", "audit", "diagnose")
"""Verbs whose example the help of all verbs shows; each verb's help shows its own."""

LISTED = ("audit", "control", "convert", "diagnose", "estimate", "fly", "prove", "simulate", "sysid", "tune")
"""Verbs with --list, see ``listing.LISTS``."""

DONE, FAILED, BAD, INTERRUPTED = 0, 1, 2, 130


class Verbs(click.Group):
    """A group that knows the names of its commands and loads one when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in VERBS:
            return None
        command: click.Command = getattr(importlib.import_module(f"nanobench_tools.cli.{cmd_name}"), cmd_name)
        command.epilog = command.epilog or f"Example: {VERBS[cmd_name][1]}"
        if command.add_help_option:
            from .help_pages import help_option

            command.add_help_option = False
            command.params.append(help_option(cmd_name, VERBS[cmd_name][1]))
        if cmd_name in LISTED and not any(parameter.name == "list" for parameter in command.params):
            from .listing import list_option

            command.params.append(list_option(cmd_name))
        return command

    def resolve_command(self, ctx: click.Context, args: list[str],
                        ) -> tuple[str | None, click.Command | None, list[str]]:
        if args[0] not in VERBS:
            near = difflib.get_close_matches(args[0], VERBS, n=1, cutoff=0.4)
            hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(VERBS)}"
            raise click.UsageError(f"no verb {args[0]!r}; {hint}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Verbs"):
            formatter.write_dl([(name, text) for name, (text, _) in VERBS.items()])
        with formatter.section("Examples"), formatter.indentation():
            for verb in FIRST:
                formatter.write_text(VERBS[verb][1])


@click.group(cls=Verbs, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
             no_args_is_help=False, invoke_without_command=True)
@click.version_option(__version__, "--version", prog_name="nanobench")
@click.pass_context
def cli(ctx: click.Context) -> None:
    """Recordings of a small quadrotor in, honest scores out.

    Where was it really, how would another controller fly it, what physics does it obey: from recordings, without the
    faults of the data. See "nanobench VERB --help".
    """
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())


def main(argv: list[str] | None = None) -> int:
    """Runs the command line ``argv`` (default: of this process) and returns the exit code."""
    warnings.showwarning = _warn
    for stream in (sys.stdout, sys.stderr):  # names of files may hold bytes that cannot be printed
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    words = list(sys.argv[1:] if argv is None else argv)
    words = todays_options(next((word for word in words if word in VERBS), ""), words)
    try:
        ours_first()
        with cli.make_context("nanobench", list(words)) as context:  # click's own main() has other exit codes
            context.meta["nanobench.words"] = words  # see ``closing``
            code = cli.invoke(context)
        sys.stdout.flush()
        return code if isinstance(code, int) else DONE
    except click.exceptions.Exit as stop:
        return stop.exit_code
    except click.UsageError as error:
        return _complain(_usage_line(error, words), BAD)
    except click.ClickException as error:
        return _complain(f"nanobench: {error.format_message()}", BAD)
    except NanobenchError as error:
        return _complain(f"nanobench: {error}", BAD)
    except (KeyboardInterrupt, click.Abort):
        return _complain("nanobench: interrupted; run the same command again to resume", INTERRUPTED)
    except BrokenPipeError:
        # The reader (head, less) has what it wanted; Python must not complain again when it flushes at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except Exception as error:  # a bug of ours; the user still gets one line
        if os.environ.get("NANOBENCH_DEBUG"):
            traceback.print_exc()
            return BAD
        text = f"nanobench: {type(error).__name__}: {error}; this is a bug; NANOBENCH_DEBUG=1 shows where"
        return _complain(text, BAD)


def _usage_line(error: click.UsageError, argv: list[str]) -> str:
    verb = next((word for word in argv if word in VERBS), None)  # click does not always say where it was
    place = error.ctx.command_path if error.ctx else " ".join(["nanobench", *filter(None, [verb])])
    return f"{place}: {error.format_message().rstrip('.')}; see {place} --help"


def _complain(text: str, code: int) -> int:
    print(" ".join(text.split()), file=sys.stderr)
    return code


def _warn(message: Warning | str, category: type[Warning], filename: str, lineno: int, file: TextIO | None = None,
          line: str | None = None) -> None:
    """Warnings as one line, without source."""
    print(" ".join(f"nanobench: warning: {message}".split()), file=file or sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
