"""Reading and writing of files: bounded input, complete output, sealed results; `specifications` of rigs and protocols.

Translates records to and from files; independent of what is computed from them.
"""
