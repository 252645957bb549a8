"""Pages of the explorer that are open in a browser, with everything they complained about or asked for."""

import re
import weakref

import steadyslip as ss
from rigs_of_theory import SIGMA, rate_state, rig

INCLINED = rig(contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.5), stiffness=9e9)

MOVED = rig(friction=rate_state(evolution=ss.laws.Aging()), radiation_damping=1e5, stiffness=3e9)

FOLLOW = """link => new Promise((done) => {
  addEventListener("hashchange", () => setTimeout(done), { once: true });
  setTimeout(done, 500); // where it is the same
  location.hash = link;
})"""

IDLE = weakref.WeakKeyDictionary()  # ordinary tabs of a browser: a fresh one takes longer than most visits


class Visit:
    """A page that is open, with everything it complained about or asked for."""

    def __init__(self, browser, path, link="", **options):
        self._idle = None if options else IDLE.setdefault(browser, [])
        self.page = self._idle.pop() if self._idle else browser.new_context(**options).new_page()
        self.complaints, self.requests = [], []
        self._hears = {
            "console": lambda message: self.complaints.append(message.text),
            "pageerror": lambda error: self.complaints.append(str(error)),
            "request": lambda request: self.requests.append(request.url),
        }
        for what, hear in self._hears.items():
            self.page.on(what, hear)
        self.page.goto(path.as_uri() + link)
        self.page.locator(".steadyslip[data-ready]").first.wait_for(state="attached")  # no code, which pages forbid
        waiting = ".steadyslip-root:not([data-ready]), .steadyslip:not([data-ready])"
        self.page.locator(waiting).first.wait_for(state="detached")

    def leave(self, whole=True):
        if self._idle is None or not whole:
            self.page.context.close()
            return
        for what, hear in self._hears.items():
            self.page.remove_listener(what, hear)
        self.page.set_viewport_size({"width": 1280, "height": 720})
        self.page.emulate_media(media="null", color_scheme="null")
        self.page.goto("about:blank")
        self._idle.append(self.page)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.leave(whole=error[0] is None)
        assert not self.complaints, self.complaints

    def sentence(self):
        return self.page.inner_text("h1").replace("\u00a0", " ")

    def reason(self):
        return self.page.locator(".verdict p").first.inner_text().replace("\u00a0", " ")

    def field(self, name):
        return self.page.locator(f'input[type=text][data-name="{name}"]')

    def slider(self, name):
        return self.page.locator(f'input[type=range][data-name="{name}"]')

    def type(self, name, text):
        self.field(name).fill(text)
        self.field(name).press("Tab")

    def told(self, pattern):
        """What the page says of a motion, once it is this."""
        found = self.page.locator(".told", has_text=re.compile(pattern.replace(" ", r"\s")))  # some do not break
        found.wait_for(state="attached")
        return found.inner_text().replace("\xa0", " ")

    def saved(self, button, encoding="utf-8"):
        with self.page.expect_download() as waiting:
            self.page.get_by_role("button", name=button).click()
        return waiting.value.path().read_text(encoding=encoding)


def edges_of(visit):
    """The list of nearest edges as it is read: name and value."""
    told = "all => all.map((one) => [one.dataset.name, one.textContent.split(' → ')[1].split('\\u00a0')[0]])"
    return dict(visit.page.locator(".edges button").evaluate_all(told))


def middle(element):
    box = element.bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
