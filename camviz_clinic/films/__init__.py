"""Films of a board in place of pictures: their best frames, chosen by what each adds to what is known of the camera."""

from camviz_clinic.films.reading import Film, FilmError, Frame
from camviz_clinic.films.taking import Chosen, chosen_frames

__all__ = ["Chosen", "Film", "FilmError", "Frame", "chosen_frames"]
