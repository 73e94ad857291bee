"""The engine of interactive viewers: what is asked for, rendered on a thread, newest first."""
