"""World: real scene and virtual objects, prepared on the device for rays."""
