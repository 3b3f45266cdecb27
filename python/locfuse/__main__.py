# SPDX-License-Identifier: Apache-2.0
"""`python -m locfuse`."""

from locfuse.cli import main

main()
