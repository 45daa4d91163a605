"""The entries of the ledger on kernels: reflection laws, collision laws and their matrices."""
