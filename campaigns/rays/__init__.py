"""Campaigns of rays, polygons and disks."""
