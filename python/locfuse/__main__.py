# SPDX-License-Identifier: Apache-2.0
"""`locfuse` and `python -m locfuse`."""


def main() -> None:
    """Run the command line."""
    # Here, as each worker of a sweep imports the script that started it, without running it.
    from locfuse.cli.app import main as run

    run()


if __name__ == "__main__":
    main()
