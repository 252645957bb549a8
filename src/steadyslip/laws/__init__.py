"""Laws of `friction` and of `contact`: frozen records whose methods are expressions.

Know nothing of where they are used: rigs, Models, files, anything that is computed of them.
"""
