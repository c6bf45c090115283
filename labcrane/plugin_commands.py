"""Find the commands that installed plugins offer."""

from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import EntryPoint
from typing import cast

from labcrane.errors import PluginError
from labcrane.offers import CommandOffer
from labcrane.plugin_modules import load_plugins


def plugin_commands(
    plugins: Iterable[EntryPoint] | None = None,
) -> Mapping[tuple[str, str], CommandOffer]:
    """Return what plugins offer, by the words that the user types.

    A plugin that cannot be imported offers nothing: ``labcrane plugins`` says why.

    Raises
    ------
    PluginError
        Two plugins offer the same words.
    """
    manager = load_plugins(plugins).manager
    found: dict[tuple[str, str], CommandOffer] = {}
    owners: dict[tuple[str, str], str] = {}
    for implementation in manager.hook.labcrane_commands.get_hookimpls():
        offers = cast("Sequence[CommandOffer]", implementation.function())
        for offer in offers:
            if offer.words in found:
                raise PluginError(
                    f"plugins {owners[offer.words]!r} and {implementation.plugin_name!r} both "
                    f"offer the command {' '.join(offer.words)!r}; uninstall one of them"
                )
            found[offer.words] = offer
            owners[offer.words] = implementation.plugin_name
    return found
