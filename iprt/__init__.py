"""Insert virtual objects into 360° RGBD video, lit by the video and casting shadows into it."""

__version__ = "0.1.0"
