"""What a test of a whole study needs: its protocol as read, its plan, a session and a command."""

from labcrane.cli.app import main
from labcrane.design.plan import plan_session
from labcrane.protocol.study import Study, load
from labcrane.registry.registry import Registry, discover
from labcrane.session.commands import Command, Order, QueueConsole
from labcrane.session.session import run
from labcrane.session.visit import Visit

__all__ = [
    "Command",
    "Order",
    "QueueConsole",
    "Registry",
    "Study",
    "Visit",
    "discover",
    "load",
    "main",
    "plan_session",
    "run",
]
