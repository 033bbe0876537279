"""What a class with camviz needs of any JupyterHub: each line with its reason. README.md says where it goes.

`tools/benchmarks/class.py` runs sixty students on a hub that loads this file.
"""

c = get_config()  # noqa: F821  # JupyterHub gives this name to the files that it loads

# Two cores start four servers at once. All sixty at once would take as long, and each would see nothing until the end.
c.JupyterHub.concurrent_spawn_limit = 4

# Who comes fifth is asked to come back after 5 to 15 s. Left alone, the hub says 30 to 60.
# (JupyterHub 6.1 heeds this setting here, and not as a trait.)
c.JupyterHub.tornado_settings.update({"spawn_throttle_retry_range": (5, 15)})

# When the hub is restarted, the students' servers and kernels go on. Left alone, it would stop them all.
c.JupyterHub.cleanup_servers = False

# A proxy that was restarted has forgotten where the students' servers are. The hub tells it in 30 s, not in 300.
c.JupyterHub.last_activity_interval = 30

# A server that starts among fifty others that work takes longer than the 30 s that are usual.
c.Spawner.http_timeout = 120
c.Spawner.start_timeout = 180

c.Spawner.args.extend(
    [
        # Each picture goes to the browser at once: a slider answers 40 ms sooner.
        "--ServerApp.jpserver_extensions=camviz_school.server=True",
        # A kernel whose browser has been away for an hour ends, and gives its memory to others. What was saved stays.
        "--MappingKernelManager.cull_idle_timeout=3600",
        "--MappingKernelManager.cull_interval=300",
        # Kernels that are looked at are left alone.
        "--MappingKernelManager.cull_connected=False",
        # A server without a kernel for another hour ends.
        "--ServerApp.shutdown_no_activity_timeout=3600",
    ]
)

c.Spawner.environment.update(
    {
        # Wireframes: solid pictures take a kernel up to 300 MB more and need a processor each, for servers have no GPU.
        "CAMVIZ_RENDERER": "wire",
        # One processor a student: libraries that start a thread on each would stand in each other's way.
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "OPENCV_FOR_THREADS_NUM": "1",
        # What a server needed to hand out a notebook or a picture goes back to the system: 10 MB for each of them.
        "MALLOC_ARENA_MAX": "2",
        "MALLOC_TRIM_THRESHOLD_": "131072",
    }
)
