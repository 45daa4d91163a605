"""The compiled collision of the disk: free motion, first contacts and reflections."""
