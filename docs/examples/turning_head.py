"""Render a view while the head turns, write the last picture and print the time of each pass.

Run from the repository's root: python docs/examples/turning_head.py
"""

from dataclasses import replace
from pathlib import Path

import iprt
from iprt.output.picture import write_picture

scene = iprt.Scene.open(Path("scenes360/room"))
view = scene.views["table"].view.resized(160, 160)
device = iprt.ComputeDevice(iprt.choose_device())  # or choose_device("gpu"), "cpu", part of a name

with iprt.Renderer(device, scene.frame(), scene.instances_of("table"), view) as renderer:
    picture = renderer.render(frames=4)  # picture.color: (160, 160, 3) float32, linear radiance
    for step in range(4):
        renderer.look(replace(view, yaw_deg=view.yaw_deg + 0.5 * step))
        picture = renderer.render(aovs=["normal"])

write_picture(Path("out/table.png"), picture.color, exposure=scene.exposure)
for entry in device.profile.passes():
    print(f"{entry.name:16} {entry.ms / device.profile.frames:8.2f} ms per frame")
