"""Plugins: found, imported, described, scaffolded and watched.

In come entry points and the folder ``plugins/`` beside a protocol; out go offers by role and name,
and proxies that name the plugin when a call fails, is late or is no number.
"""
