"""What every test runs under."""

from hypothesis import HealthCheck, settings

# Two cores shared by several workers: no deadlines. The same examples on every run, so that a red run can be repeated.
settings.register_profile(
    "camviz", deadline=None, derandomize=True, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("camviz")
