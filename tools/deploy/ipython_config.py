"""Memory that one kernel may take: beyond it a cell ends with MemoryError, and its kernel and everyone else's live on.

Copy it to `etc/ipython/` in the environment of the kernels (`python -c "import sys; print(sys.prefix)"` names it).
CAMVIZ_KERNEL_MB sets another limit. It counts what a kernel has asked for, also where it has not written yet: lessons,
which hold 180 to 310 MB, have asked for up to 750. With a limit of 700 two of them failed.
"""

c = get_config()  # noqa: F821  # IPython gives this name to the files that it loads

c.InteractiveShellApp.exec_lines = [
    """
try:
    import os as _os, resource as _resource
    _bytes = int(_os.environ.get("CAMVIZ_KERNEL_MB", "1500")) << 20
    _resource.setrlimit(_resource.RLIMIT_DATA, (_bytes, _bytes))
    del _os, _resource, _bytes
except ImportError:  # Windows has no such limit
    pass
""".strip()
]
