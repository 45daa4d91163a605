"""The entries of the ledger on geometry: coordinates, the disk's frame, its configuration space, rigid collision.

A file holds the entries of a subject, each a decorated check; the reader finds new files by itself. A check takes a
formula as code and returns a verdict: `verify` for identities (kind "symbolic", must be *proved*), `agreement`,
`no_excess` and `holds` for numbers (kind "numeric"); `every` joins several. The right formula is that of the library
wherever there is one. No module here imports sympy before a check runs.
"""
