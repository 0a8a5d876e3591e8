"""Options of a command as a form: each is a field, by its type, with its unit, bounds and choices."""

from collections.abc import Callable, Mapping
from typing import Any

from nicegui import ui
from nicegui.element import Element

from taskcal_groundwork.options import SIGNS, UNITS, OptionError, StatedOption
from taskcal_studio.controls import ValueInput, choice, labelled, set_attribute, text, tick
from taskcal_studio.project import LAYOUT, RESULT, Project
from taskcal_studio.stated_options import BEGUN, Statements, check_stated, name_of, offered
from taskcal_studio.texts import Texts

FOLDERS: Mapping[str, str] = {"like": LAYOUT.calibrations}
"""Of the files that an option chooses among."""


def of_project(project: Project, command: str) -> Statements:
    """What the project states of a command's options."""
    return Statements(
        command=command,
        now=lambda: project.choices.options.get(command, {}),
        keep=lambda name, given: project.state(command, name, given),
    )


def option_fields(project: Project, texts: Texts, stated: Statements, *names: str) -> None:
    """Fields of options; what cannot be is said where it stands, and not kept."""
    with ui.element("div").classes("fields"):
        for name in names:
            _Field(project, texts, stated, offered(stated.command)[name])


class _Field:
    """The field of an option."""

    def __init__(self, project: Project, texts: Texts, stated: Statements, one: StatedOption) -> None:
        self._project, self._texts, self._stated, self._one = project, texts, stated, one
        begun: Any = BEGUN[stated.command].get(one.name, one.written(one.default))
        self._begun = "" if begun is None else str(begun).lower() if one.kind is bool else f"{begun}"
        self._now = stated.now().get(one.name, self._begun)
        label = texts.named("option", one.name)
        for made in self._controls(f"{label} ({self._sign})" if self._sign else label):
            set_attribute(made, "title", texts.sentence({"template": one.option.help, "values": {}}))
        self._said = text("span", "").classes("message").props("role=alert")
        self._said.set_visibility(False)

    @property
    def _unit(self) -> str:
        return self._one.option.shown or self._one.option.unit

    @property
    def _sign(self) -> str:
        return SIGNS.get(self._unit, self._unit)

    def _controls(self, label: str) -> list[Element]:
        one, known, now = self._one, self._choices(), self._now
        if one.kind is bool:
            return [tick(label, now == "true", lambda value: self._take(str(value).lower()))]
        if not known:
            return [self._line(label, self._shown(now), self._take)]
        if one.names_file or not one.option.suggested:
            return [choice(label, known, now, self._take)]
        listed = choice(label, known | ({} if now in known else {now: now}), now, self._take_anew)
        own = self._line(self._texts.named("option", f"{one.name} own"), "" if now in known else now, self._take_anew)
        return [listed, own]

    def _choices(self) -> dict[str, str]:
        """Texts to choose among; none where the option is free."""
        one, texts = self._one, self._texts
        known = {key: self._named(key) for key in (*one.choices, *one.option.suggested)}
        if known and not self._begun:
            known = {"": texts.named("option", f"{one.name} empty")} | known
        if one.name in FOLDERS:
            found = self._project.files(FOLDERS[one.name], (".json",))
            return {"": texts("option.no_file")} | {path: path for path in found if not path.endswith(RESULT)}
        return known

    def _named(self, key: str) -> str:
        """A choice in words; a symbol, such as O1, as it is."""
        named = f"{self._one.name} {key}"
        found = self._texts.named("option", named)
        return key if found == named else found

    def _line(self, label: str, now: str, take: Callable[[str], object]) -> Element:
        own, kind = self._one.option, {"type": "text"}
        if self._one.is_number:
            bounds = {"min": own.low, "max": own.high}
            kind = {"type": "number", "step": "1" if self._one.kind is int else "any"}
            kind |= {key: f"{bound * self._scale:g}" for key, bound in bounds.items() if bound is not None}
        field = ValueInput(kind.pop("type"), label, now, **kind)
        return labelled(label, field.on_left(lambda given: take(self._written(given))).classes("value"))

    # A number as a page shows it, and as it is written.

    @property
    def _scale(self) -> float:
        return UNITS[self._one.option.unit] / UNITS[self._unit]

    def _shown(self, written: str) -> str:
        return f"{float(written) * self._scale:.10g}" if written and self._one.is_number else written

    def _written(self, shown: str) -> str:
        try:
            return f"{float(shown) / self._scale:.10g}" if shown and self._scale != 1.0 else shown
        except ValueError:
            return shown

    def _label_of(self, field: str) -> str:
        return self._texts("option.quoted", name=self._texts.named("option", name_of(self._stated.command, field)))

    def _take_anew(self, given: str) -> None:
        """Keep a text, and show the page anew where it was kept: another field of the option shows it, too."""
        if self._keep(given):
            ui.navigate.reload()

    def _take(self, given: str) -> None:
        self._keep(given)

    def _keep(self, given: str) -> bool:
        """Keep a text, an empty one of an option that always has a value as what it begins with; whether it can be."""
        name, stated = self._one.name, self._stated
        given = given or (self._begun if self._one.always else "")
        self._said.set_visibility(False)
        try:
            check_stated(stated.command, {**stated.now(), name: given}, shown=True)
        except OptionError as wrong:
            self._said.set_text(self._texts.sentence(wrong.said(self._label_of).parts))
            self._said.set_visibility(True)
            return False
        stated.keep(name, given)
        return True
