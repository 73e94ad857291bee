"""The interactive viewers, from the device up; read `engine`, then `viewport`.

- `engine` has the thread that owns the device and renders for any number of clients: `core` does
  its work turn by turn, a `session` per client keeps a `canvas` (a renderer) in motion and at rest.
- A `viewport` is one window on it: camera, `lens`, comparisons, what is at a pixel; by `motion` and
  `pace`, what is given up to hold a frame rate.
- `desktop` and `web` draw viewports, and the panels that `fields` describes; each runs without
  the other.

Nobody waits for the device:

    with Engine(scene, lambda: ComputeDevice(choose_device(), limit_s=60.0)) as engine:
        viewport = Viewport(engine, view)
        viewport.turn(10.0, 0.0)
        displayed = viewport.poll()  # once per frame of the window: pixels, and what they are worth
"""
