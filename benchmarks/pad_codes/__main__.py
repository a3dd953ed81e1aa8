"""``python -m benchmarks.pad_codes``."""

from benchmarks.pad_codes.parts import main

main()
