"""The chart as a camera counts it."""

from camviz.colour import balance, spectra


def raw_chart(camera, name):
    """The chart's raw colours (24, 3) and a perfect white's (3,), whose green is 1."""
    light, sensitivity = spectra.illuminant(name), spectra.sensitivities(camera)
    white = balance.response(light, 1, sensitivity)
    return balance.response(light, spectra.reflectances(), sensitivity) / white[1], white / white[1]
