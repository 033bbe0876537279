"""The gallery of recipes: twelve of them, each one sentence and a few lines. Its cells run as a test of their own."""

from pathlib import Path

import nbformat

NOTEBOOK = nbformat.read(Path(__file__).parents[1] / "lessons/material/neighbours.ipynb", 4)
RECIPES = [cell for cell in NOTEBOOK.cells if cell.source.startswith("## ")]


def test_there_are_twelve_recipes_of_one_sentence_each():
    assert [cell.source.split()[1] for cell in RECIPES] == [str(i + 1) for i in range(12)]
    for cell in RECIPES:
        (sentence,) = cell.source.splitlines()[2:]
        assert sentence.endswith(".")
        assert ". " not in sentence
        assert len(sentence.split()) <= 35


def test_a_recipe_is_short_and_no_cell_longer_than_twelve_lines():
    code = [cell.source for cell in NOTEBOOK.cells if cell.cell_type == "code"][1:]  # after the first, the setting up
    assert [source for source in code if len(source.splitlines()) > 12] == []
