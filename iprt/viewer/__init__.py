"""The engine of interactive viewers, without a window: read `iprt.viewer.engine` first.

One thread owns the device (`core`, turn by turn; `session`, a renderer per client). Viewers ask by
`Client.ask` and `Engine`'s methods, which never wait, and show `Client.shown`:

    with Engine(scene, lambda: ComputeDevice(choose_device(), limit_s=60.0)) as engine:
        client = engine.client(Request(view))
        number = client.ask(Request(replace(view, yaw_deg=10.0)))
        shown = client.wait(number, timeout_s=1.0)  # or client.shown, once per window frame
"""
