"""When a component is done."""
