"""The pictures of a 360° video: where they come from, and how they become frames."""
