"""`camviz completion`: the Tab key in bash, zsh and fish, made from the commands' own parsers."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Any

from camviz_clinic.commands.common import OK, add_command
from camviz_clinic.commands.terminal import tell

COMPLETION = """\
Prints what makes a shell complete the commands of camviz, their options and the options' choices when you press Tab.
File names are completed as everywhere else.
"""
EPILOG = """\
examples:
  eval "$(camviz completion bash)"                                 in ~/.bashrc
  eval "$(camviz completion zsh)"                                  in ~/.zshrc, after compinit
  camviz completion fish > ~/.config/fish/completions/camviz.fish
"""


def add(commands: Any) -> None:
    command = add_command(commands, "completion", completion, "complete camviz in bash, zsh or fish", COMPLETION)
    command.epilog = EPILOG
    command.add_argument("shell", metavar="SHELL", choices=tuple(SHELLS), help="bash, zsh or fish")
    command.set_defaults(commands=commands.choices)


def completion(options: argparse.Namespace) -> int:
    """Print the script of a shell."""
    tell(SHELLS[options.shell](options.commands))
    return OK


def _options(command: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    return (action for action in command._actions if action.option_strings)


def _words(commands: Mapping[str, argparse.ArgumentParser]) -> Iterator[tuple[str, str]]:
    """(pattern of "command" or "command:option before", words that fit there)."""
    for name, command in commands.items():
        for action in _options(command):
            if action.choices:
                yield f"{name}:{action.option_strings[-1]}", " ".join(map(str, action.choices))
        choices = [str(c) for action in command._actions if not action.option_strings for c in action.choices or ()]
        yield f"{name}:*", " ".join([*(action.option_strings[-1] for action in _options(command)), *choices])


def _bash(commands: Mapping[str, argparse.ArgumentParser]) -> str:
    cases = "\n".join(f'    {pattern}) words="{words}" ;;' for pattern, words in _words(commands))
    return f"""_camviz() {{
  local now="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}" words
  [ "$COMP_CWORD" -eq 1 ] && {{ COMPREPLY=($(compgen -W "{" ".join(commands)}" -- "$now")); return; }}
  case "${{COMP_WORDS[1]}}:$before" in
{cases}
  esac
  COMPREPLY=($(compgen -W "$words" -- "$now"))
}}
complete -o default -F _camviz camviz"""


def _zsh(commands: Mapping[str, argparse.ArgumentParser]) -> str:
    cases = "\n".join(f"    ({pattern}) given=({words}) ;;" for pattern, words in _words(commands))
    return f"""_camviz() {{
  local -a given
  (( CURRENT == 2 )) && {{ compadd -- {" ".join(commands)}; return }}
  case "$words[2]:$words[CURRENT-1]" in
{cases}
  esac
  compadd -- $given
  _files
}}
compdef _camviz camviz"""


def _fish(commands: Mapping[str, argparse.ArgumentParser]) -> str:
    lines = []
    for name, command in commands.items():
        lines.append(f"complete -c camviz -n __fish_use_subcommand -f -a {name}")
        for action in _options(command):
            shape = [f"-l {word[2:]}" if word.startswith("--") else f"-s {word[1:]}" for word in action.option_strings]
            choices = f' -x -a "{" ".join(map(str, action.choices))}"' if action.choices else ""
            lines.append(f"complete -c camviz -n '__fish_seen_subcommand_from {name}' {' '.join(shape)}{choices}")
    return "\n".join(lines)


SHELLS: Mapping[str, Callable[[Mapping[str, argparse.ArgumentParser]], str]] = MappingProxyType(
    {"bash": _bash, "zsh": _zsh, "fish": _fish}
)
