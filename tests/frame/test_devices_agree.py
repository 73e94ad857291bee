"""Two OpenCL implementations show the same pictures: PoCL and Intel's CPU runtime.

Their rounding differs, so that a few rays meet something else; what is shown may hardly differ.
"""

from __future__ import annotations

import numpy as np
import pytest

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.errors import DeviceError
from iprt.geometry.camera import View
from iprt.output.display import display
from tests.frame.test_determinism import walk
from tests.frame.whole_frame import METHOD

pytestmark = [pytest.mark.gl, pytest.mark.thorough]

NAMES = ("pocl", "intel")
NEEDED = "needs PoCL and Intel's CPU runtime (pip install iprt[pocl,intel])"
LEVELS = 2.0 / 255.0
SHARE = 0.999
VIEW = View(128, 96, pitch_deg=-35.0)


@pytest.fixture(scope="module")
def both(device: ComputeDevice) -> list[ComputeDevice]:
    """A device of each implementation; one is that of the other tests, whose kernels are built."""
    try:
        found = [choose_device(name) for name in NAMES]
    except DeviceError as error:
        pytest.skip(f"{NEEDED}: {error}")
    if found[0] == found[1]:  # PoCL's device has the processor's name
        pytest.skip(NEEDED)
    return [device if one == device.device else ComputeDevice(one) for one in found]


@METHOD
def test_pictures_agree(both: list[ComputeDevice], method: tuple[str, str]) -> None:
    """At rest, in motion and after the video changed: at most 2/255 on 99.9% of the pixels."""
    for step, (one, other) in enumerate(zip(*(walk(d, method, VIEW) for d in both), strict=True)):
        exposure = 0.4 / float(one.color.mean())
        shown, wanted = (display(picture.color, exposure) for picture in (one, other))
        apart = np.abs(shown - wanted).max(-1)
        share = float((apart <= LEVELS).mean())
        assert share >= SHARE, f"picture {step}: {share:.4f}, at most {apart.max() * 255:.1f}/255"
        assert not np.array_equal(one.color, other.color), "compared with itself"
