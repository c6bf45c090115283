"""Commands that installed plugins offer."""

from collections.abc import Iterable, Mapping

from labcrane.errors import PluginError
from labcrane.registry.entry_points import EntryPoint
from labcrane.registry.loader import PluginModules, offered
from labcrane.registry.offers import CommandOffer


def plugin_commands(
    plugins: Iterable[EntryPoint] | None = None,
) -> Mapping[tuple[str, str], CommandOffer]:
    """Return the commands of plugins, by the words that the user types.

    A plugin that cannot be imported offers nothing: ``labcrane plugins`` says why.

    Raises
    ------
    PluginError
        Two plugins offer the same words, or the hook of one fails.
    """
    modules = PluginModules(plugins)
    modules.load()
    found: dict[tuple[str, str], CommandOffer] = {}
    owners: dict[tuple[str, str], str] = {}
    for implementation in modules.manager.hook.labcrane_commands.get_hookimpls():
        plugin = implementation.plugin_name
        try:
            offers = offered(implementation, CommandOffer, "labcrane.registry.CommandOffer(...)")
        except PluginError as error:
            raise PluginError(f"plugin {plugin!r} is broken: {error}") from error
        for offer in offers:
            if offer.words in found:
                raise PluginError(
                    f"plugins {owners[offer.words]!r} and {plugin!r} both offer the command "
                    f"{' '.join(offer.words)!r}; uninstall one of them"
                )
            found[offer.words] = offer
            owners[offer.words] = plugin
    return found
