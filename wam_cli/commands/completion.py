"""`wam completion`: what makes a shell complete the words of `wam`."""

import argparse


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("shell", choices=("bash", "zsh", "fish"))
    parser.epilog = (
        'In ~/.bashrc or ~/.zshrc: eval "$(wam completion bash)" (or zsh); in ~/.config/fish/config.fish: '
        "wam completion fish | source.  Needs argcomplete: pip install 'wam_stack[completion]'"
    )


def run(given: argparse.Namespace) -> int:
    """Print the script."""
    from argcomplete.shell_integration import shellcode

    print(shellcode(["wam"], shell=given.shell))
    return 0
