"""Translations of the pages' own wording into the participant's language."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from labcrane.core.items import Item
from labcrane.protocol.pages import Language


@dataclass(frozen=True, slots=True)
class Words:
    """One language.

    Attributes
    ----------
    wait, thanks, stale
        Texts while there are no questions, after the session has ended, and while the page's server
        does not reach it.
    progress
        A pattern with ``{done}`` and ``{total}``.
    one_of, span, stepped, text
        Patterns of which answers an item takes: ``{names}``; ``{low}`` and ``{high}``; ``{span}``
        with ``{step}``; and what an item of words takes.
    lacking, personal, possible
        Messages for a questionnaire with gaps, for text with personal data, and for a value that
        an item does not take (with ``{takes}``).
    seen, heard
        Patterns with ``{what}``: the label of the button that reports something, and the text after
        the report has arrived.
    names
        Of the things that the bundled tasks ask about.
    """

    wait: str
    thanks: str
    stale: str
    progress: str
    back: str
    on: str
    no_answer: str
    hand_in: str
    saved: str
    declined: str
    not_taken: str
    consent: str
    version: str
    take_part: str
    open_file: str
    one_of: str
    span: str
    stepped: str
    text: str
    lacking: str
    personal: str
    possible: str
    seen: str
    heard: str
    names: Mapping[str, str] = field(default_factory=dict)

    def about(self, pattern: str, what: str) -> str:
        """Return a pattern filled with a thing's name."""
        return pattern.format(what=self.names.get(what, what))

    def takes(self, item: Item) -> str:
        """Return what an item takes."""
        if item.kind == "choice":
            return self.one_of.format(names=", ".join(item.labels or item.choices))
        if item.kind == "text":
            return self.text
        span = self.span.format(low=f"{item.lowest:g}", high=f"{item.highest:g}")
        if item.step:
            span = self.stepped.format(span=span, step=f"{item.step:g}")
        return f"{span}: {item.meanings}" if item.meanings else span

    def refused(self, item: Item | None) -> str:
        """Return why an answer was not accepted, or a questionnaire that lacks some."""
        if item is None:
            return self.lacking
        return (
            self.personal if item.kind == "text" else self.possible.format(takes=self.takes(item))
        )


ENGLISH = Words(
    wait="Please wait. There are no questions right now.",
    thanks="Thank you for taking part. The session has ended. You can stop here.",
    stale="Connection lost: what is shown is old. Please wait; it comes back by itself.",
    progress="{done} of {total} answered",
    back="Back",
    on="Next",
    no_answer="No answer",
    hand_in="Submit",
    saved="saved",
    declined="no answer given",
    not_taken="not accepted",
    consent="Consent",
    version="version",
    take_part="I have read this text and agree to take part",
    open_file="Open",
    one_of="one of {names}",
    span="{low} to {high}",
    stepped="{span} in steps of {step}",
    text="words",
    lacking="Some answers are missing: please answer, or choose “No answer”",
    personal="Please write without an e-mail address or a telephone number",
    possible="Possible is {takes}",
    seen="I see: {what}",
    heard="{what}: reported",
)

GERMAN = Words(
    wait="Bitte warten. Im Moment ist nichts zu beantworten.",
    thanks="Vielen Dank für Ihre Teilnahme. Die Sitzung ist zu Ende; hier ist nichts mehr zu tun.",
    stale="Keine Verbindung: Die Anzeige ist veraltet. Bitte warten; sie kommt von selbst zurück.",
    progress="{done} von {total} beantwortet",
    back="Zurück",
    on="Weiter",
    no_answer="Keine Angabe",
    hand_in="Abgeben",
    saved="gespeichert",
    declined="ohne Angabe",
    not_taken="nicht angenommen",
    consent="Einwilligung",
    version="Fassung",
    take_part="Ich habe diesen Text gelesen und nehme teil",
    open_file="Öffnen:",
    one_of="eines von {names}",
    span="{low} bis {high}",
    stepped="{span} in Schritten von {step}",
    text="Worte",
    lacking="Es fehlen noch Antworten: bitte antworten oder „Keine Angabe“ wählen",
    personal="Bitte ohne E-Mail-Adresse und Telefonnummer schreiben",
    possible="Möglich ist {takes}",
    seen="Ich sehe: {what}",
    heard="{what}: gemeldet",
    names={"deformity": "Verformung"},
)

POLISH = Words(
    wait="Proszę czekać. W tej chwili nie ma pytań.",
    thanks="Dziękujemy za udział. Sesja jest zakończona i nie trzeba tu już nic robić.",
    stale="Brak połączenia: to, co widać, jest nieaktualne. Proszę czekać; wróci samo.",
    progress="odpowiedzi: {done} z {total}",
    back="Wstecz",
    on="Dalej",
    no_answer="Bez odpowiedzi",
    hand_in="Oddaj",
    saved="zapisano",
    declined="bez odpowiedzi",
    not_taken="nie przyjęto",
    consent="Zgoda na udział",
    version="wersja",
    take_part="Przeczytałam lub przeczytałem ten tekst i biorę udział",
    open_file="Otwórz:",
    one_of="jedna z odpowiedzi: {names}",
    span="od {low} do {high}",
    stepped="{span} co {step}",
    text="tekst",
    lacking="Brakuje jeszcze odpowiedzi: proszę odpowiedzieć albo wybrać „Bez odpowiedzi”",
    personal="Proszę pisać bez adresu e-mail i numeru telefonu",
    possible="Możliwa odpowiedź: {takes}",
    seen="Widzę: {what}",
    heard="{what}: zgłoszono",
    names={"deformity": "zniekształcenie"},
)

FRENCH = Words(
    wait="Veuillez patienter. Il n’y a rien à répondre pour le moment.",
    thanks="Merci de votre participation. La séance est terminée ; il n’y a plus rien à faire ici.",
    stale="Connexion perdue : la page n’est plus à jour. Veuillez patienter ; elle revient seule.",
    progress="{done} réponses sur {total}",
    back="Retour",
    on="Suivant",
    no_answer="Sans réponse",
    hand_in="Remettre",
    saved="enregistré",
    declined="sans réponse",
    not_taken="non accepté",
    consent="Consentement",
    version="version",
    take_part="J’ai lu ce texte et je participe",
    open_file="Ouvrir :",
    one_of="l’une des réponses : {names}",
    span="de {low} à {high}",
    stepped="{span} par pas de {step}",
    text="du texte",
    lacking="Il manque encore des réponses : répondez ou choisissez « Sans réponse »",
    personal="Écrivez sans adresse e-mail ni numéro de téléphone",
    possible="Réponse possible : {takes}",
    seen="Je vois : {what}",
    heard="{what} : signalé",
    names={"deformity": "déformation"},
)

SPANISH = Words(
    wait="Espere, por favor. Ahora no hay nada que responder.",
    thanks="Gracias por participar. La sesión ha terminado y aquí ya no hay nada más que hacer.",
    stale="Conexión perdida: lo que se ve no está al día. Espere, por favor; vuelve sola.",
    progress="{done} de {total} respondidas",
    back="Atrás",
    on="Siguiente",
    no_answer="Sin respuesta",
    hand_in="Entregar",
    saved="guardado",
    declined="sin respuesta",
    not_taken="no aceptado",
    consent="Consentimiento",
    version="versión",
    take_part="He leído este texto y participo",
    open_file="Abrir:",
    one_of="una de las respuestas: {names}",
    span="de {low} a {high}",
    stepped="{span} en pasos de {step}",
    text="texto",
    lacking="Aún faltan respuestas: responda o elija «Sin respuesta»",
    personal="Escriba sin correo electrónico ni número de teléfono",
    possible="Respuesta posible: {takes}",
    seen="Veo: {what}",
    heard="{what}: comunicado",
    names={"deformity": "deformidad"},
)

WORDS: Mapping[Language, Words] = {
    "en": ENGLISH,
    "de": GERMAN,
    "pl": POLISH,
    "fr": FRENCH,
    "es": SPANISH,
}
