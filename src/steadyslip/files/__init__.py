"""Everything that is read or written: bounded input, whole output, sealed results; `specifications` of rigs, protocols.

Knows how files are made safe, and records; not what is computed from them.
"""
