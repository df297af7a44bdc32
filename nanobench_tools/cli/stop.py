"""``nanobench stop``: the emergency stop of a vehicle, from another terminal."""

import click

from ..errors import InputError
from ..steps.options import Options
from .shared_options import shared_options


@click.command()
@shared_options("data", "columns", "jobs", "scheduler", "clock", "seed")
@click.argument("uri")
def stop(options: Options, uri: str) -> int:
    """Stop the motors of a vehicle at once, wherever it is: it falls, and is locked until it is switched off and on.

    A flight of this computer sends the stop over its own link, until the vehicle acknowledges it. Without such a
    flight, a new link sends it for two seconds.
    """
    from ..radio.fly.companion import send_stop
    from ..radio.fly.stop_socket import request_stop
    from ..radio.vehicle_link import check_uri

    check_uri(uri)
    by_flight = request_stop(uri)
    if by_flight:
        options.say(f"{uri}: its flight stops the motors")
    elif send_stop(uri):
        options.say(f"{uri}: the stop was sent over a new link, and the vehicle answers")
    else:
        raise InputError(uri, "the stop was sent, but nothing answered", "is another program connected to it? Switch "
                         "the vehicle off")
    return options.finish("stop", {"uri": uri, "by_flight": by_flight})
