"""What cases of tests/vm share. Python's standard library only; runs inside the machine."""
