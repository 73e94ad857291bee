"""OpenCL: drivers, device choice, programs, buffers and times.

Importing this package settles where compiled kernels are kept, and makes the drivers known that the
OpenCL loader would miss. So it comes before pyopencl: modules elsewhere in `iprt` reach pyopencl
through the modules in here.
"""

from iprt.device.caches import settle_caches
from iprt.device.icd import register_drivers

settle_caches()
register_drivers()
