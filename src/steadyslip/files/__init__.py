"""Reading and writing of files: bounded input, complete output, sealed results; `specifications` of rigs and protocols.

Makes files safe and translates records; independent of what is computed from them.
"""
