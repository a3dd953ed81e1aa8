"""``python -m tools.figures``: write every picture and generated page of the documentation."""

from __future__ import annotations

from cmpdesign.files.atomic import write_file

from .everything import DOCS, IMAGES, pages, pictures


def main() -> None:
    """Write all pictures and pages, and print their names."""
    for name, data in pictures().items():
        write_file(IMAGES / name, data)
        print(f"docs/images/{name}: {len(data) / 1000:.0f} kB")
    for path, text in pages().items():
        write_file(path, text)
        print(path.relative_to(DOCS.parent))


if __name__ == "__main__":
    main()
