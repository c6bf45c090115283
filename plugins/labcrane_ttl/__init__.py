"""Pulses of events for other devices: over a serial port, a parallel port, or a box's commands."""

from labcrane import Machine, Offer, Trigger, hookimpl, offer
from labcrane_ttl.settings import BoxSettings, ParallelSettings, SerialSettings

labcrane_api = 1

SERIAL = {"serial": "pip install pyserial"}


@hookimpl
def labcrane_triggers() -> list[Offer[Trigger]]:
    def serial_ttl(settings: SerialSettings, machine: Machine) -> Trigger:
        from labcrane_ttl.serial_port import SerialTrigger, as_byte

        return SerialTrigger(settings, as_byte, rest=bytes(1))

    def box_ttl(settings: BoxSettings, machine: Machine) -> Trigger:
        from labcrane_ttl.serial_port import SerialTrigger

        return SerialTrigger(settings, settings.written, rest=settings.rest.encode())

    return [
        offer("serial_ttl", SerialSettings, serial_ttl, needs=SERIAL),
        offer("box_ttl", BoxSettings, box_ttl, needs=SERIAL),
        offer("parallel_ttl", ParallelSettings, "labcrane_ttl.parallel_port:ParallelTrigger"),
    ]
