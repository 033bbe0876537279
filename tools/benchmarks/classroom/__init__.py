"""What `tools/benchmarks/class.py` is made of: a hub with its proxy, students who sit at it, and what goes wrong."""
