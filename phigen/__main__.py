"""The command ``phigen``, as a script and as ``python -m phigen``."""

from phigen import interrupts

interrupts.obey()  # Called before the imports, which take time: Ctrl-C must end the process during the imports too.


def main() -> None:
    """Run the command line ``phigen`` with the arguments of the process."""
    from phigen.cli import main as run

    run()


if __name__ == "__main__":
    main()
