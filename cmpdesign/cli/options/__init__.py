"""Options and arguments that commands share, as annotated types, and the parsing of their texts.

In: the text of an option. Out: a checked value, or an error that names the option.
"""
