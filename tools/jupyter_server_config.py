"""JupyterLab takes films that are picked by a button, not only files up to 10 MB: `make setup` puts this into place."""

config = get_config()  # type: ignore[name-defined]  # noqa: F821
config.ServerApp.tornado_settings = {"websocket_max_message_size": 2**30}
