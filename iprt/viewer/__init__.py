"""The interactive viewers, from the device up; read `engine` first, then `viewport`.

- `engine` runs the thread that owns the device and renders for any number of clients. `core` does
  its work turn by turn. A `session` per client keeps two renderers, for motion and for rest.
- A `viewport` is one window on it: camera, `lens`, comparisons and pixel read-out.
  `motion_quality` decides how much quality to give up for a frame rate.
- `fields` and `actions` describe the inputs and buttons of panels, `gizmo` the geometry that is
  drawn over the picture, `ui_state` the selection, and `timeline` its keyframes. `desktop` and
  `web` only draw them, the one by imgui, the other by viser. Each runs without the other.
- `autosaver` keeps unsaved edits beside the scene, and offers edits that earlier viewers left.
- `render_queue` renders to files, by a process `iprt render` for each `render_order`. `render_form`
  and `render_fields` describe its panel.
- `windows` is what both have in common for `program`, by which other programs control them.

No caller waits for the device::

    with Engine(scene, lambda: ComputeDevice(choose_device(), limit_s=60.0)) as engine:
        viewport = Viewport(engine, view)
        viewport.turn(10.0, 0.0)
        displayed = viewport.poll()  # once per frame of the window: pixels and their state
"""
