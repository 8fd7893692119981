"""`python -m master` is `kitecosim`; an interrupt (Ctrl-C) while it loads ends it as one later does."""


def main() -> None:
    """Entry point of the `kitecosim` script."""
    try:
        from master.cli import main as command
    except KeyboardInterrupt:
        exec("")  # as in master.cli
        raise SystemExit(130) from None
    command()


if __name__ == "__main__":
    main()
