"""The compiled collision of the disk: flights, first contacts and reflections."""
