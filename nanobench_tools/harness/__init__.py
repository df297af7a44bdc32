"""Items, runner, store, manifest and progress: how methods are run over flights."""
