"""Ground truth and slow references by path tracing, with Mitsuba."""
