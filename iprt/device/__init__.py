"""OpenCL: drivers, device choice, programs, buffers and times.

Importing this package makes the drivers known that the OpenCL loader would miss, so it comes
before pyopencl: modules elsewhere in `iprt` reach pyopencl through the modules in here.
"""

from iprt.device.icd import register_drivers

register_drivers()
