"""OpenCL: drivers, device choice, programs, buffers and times.

Importing this package chooses the folder of the kernel cache and registers the drivers that the
OpenCL loader would miss. Both must happen before pyopencl is imported, so modules elsewhere in
`iprt` reach pyopencl through this package.
"""

from iprt.device.caches import settle_caches
from iprt.device.icd import register_drivers

settle_caches()
register_drivers()
