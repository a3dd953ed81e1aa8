"""How experiments run: tables, the command line, worker processes, and the way into docs/measured."""
