// Uses a page of `haptize play --html` or `inspect --html` as a person does; its value is what was found, a line each. Run by browser.py.
(async () => {
const element = (id) => document.getElementById(id), found = [];
const frame = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
const check = (what, holds, seen) => found.push(`${holds ? "ok" : "FAILED"}: ${what}${holds ? "" : ` (${seen})`}`);
const clock = () => parseFloat(element("clock").textContent);

/** Colours of a canvas in the frame after what `change` does, as one number and as the share of pixels unlike the first. */
async function seen(canvas, change = () => {}) {
    change();
    dispatchEvent(new Event("resize"));
    return new Promise((done) => requestAnimationFrame(() => {
        const copy = document.createElement("canvas");
        [copy.width, copy.height] = [canvas.width, canvas.height];
        const context = copy.getContext("2d");
        context.drawImage(canvas, 0, 0);
        const { data } = context.getImageData(0, 0, copy.width, copy.height);
        let [hash, ink] = [0, 0];
        for (let at = 0; at < data.length; at += 4) {
            hash = (hash * 31 + data[at] + 7 * data[at + 1] + 13 * data[at + 2]) | 0;
            if ([0, 1, 2].some((k) => Math.abs(data[at + k] - data[k]) > 8)) ink++;
        }
        done({ hash, ink: (4 * ink) / data.length });
    }));
}
/** A press, a way and a release of a pointer on `target`, given in shares of its size. */
function drag(target, [from, to], id = 1) {
    const { left, top, width, height } = target.getBoundingClientRect();
    const send = (type, [x, y], buttons) => {
        const place = { clientX: left + x * width, clientY: top + y * height };
        target.dispatchEvent(new PointerEvent(type, { ...place, pointerId: id, buttons, bubbles: true, cancelable: true }));
    };
    send("pointerdown", from, 1);
    send("pointermove", to, 1);
    send("pointerup", to, 0);
}
/** Clicks what lies at the middle of `target`: what covers it would take the click. */
function click(target) {
    target.scrollIntoView({ block: "center" });
    const { left, top, width, height } = target.getBoundingClientRect();
    document.elementFromPoint(left + width / 2, top + height / 2).click();
}

try {
    for (let tries = 0; tries < 200 && !element("state").textContent; tries++) await frame();
    await frame();
    const [view, map, plot, slider] = ["view", "map", "plot", "time"].map(element), isShown = (part) => !part.closest("section").hidden;
    check("no more than the width of the window is taken", document.documentElement.scrollWidth <= document.documentElement.clientWidth, document.documentElement.scrollWidth);
    for (const canvas of [view, map, plot].filter(isShown)) {
        const { ink } = await seen(canvas);
        check(`${canvas.id} shows something`, ink > 0.01 && ink < 0.99, ink);
    }
    check("the page begins in contact", element("state").textContent.startsWith("In contact"), element("state").textContent);

    const before = await seen(view);
    check("a drawing is the same twice", (await seen(view)).hash === before.hash, "other pixels");
    check("dragging turns the view", (await seen(view, () => drag(view, [[0.5, 0.5], [0.8, 0.4]]))).hash !== before.hash, "the same pixels");
    view.focus();
    const turned = await seen(view);
    const key = (name) => view.dispatchEvent(new KeyboardEvent("keydown", { key: name, bubbles: true, cancelable: true }));
    const keyed = await seen(view, () => key("ArrowLeft"));
    check("a key turns it", document.activeElement === view && keyed.hash !== turned.hash, "the same pixels");
    const near = await seen(view, () => click(element("nearer")));
    check("a button zooms", near.ink > 1.1 * keyed.ink, near.ink / keyed.ink);
    check("a key resets it", (await seen(view, () => key("0"))).hash === before.hash, "other pixels");

    if (isShown(plot)) {
        const torques = () => element("legend").textContent, atContact = torques();
        const free = await seen(view, () => { slider.value = slider.min; slider.dispatchEvent(new Event("input")); });
        await frame();
        check("the slider sets the time", element("clock").textContent === `${parseFloat(slider.min).toFixed(3)} s` && torques() !== atContact && free.hash !== before.hash, element("clock").textContent);
        check("the arm begins free", element("state").textContent.startsWith("Free"), element("state").textContent);
        click(element("play"));
        check("the button says Pause", element("play").getAttribute("aria-label") === "Pause", element("play").getAttribute("aria-label"));
        for (let tries = 0; tries < 500 && clock() < 0.1; tries++) await frame();
        click(element("play"));
        await frame();
        const stopped = clock();
        for (let frames = 0; frames < 5; frames++) await frame();
        check("playing goes on until it is paused", stopped >= 0.1 && clock() === stopped && parseFloat(slider.value).toFixed(3) === stopped.toFixed(3), `${stopped}, ${clock()}`);
        drag(plot, [[0.3, 0.5], [0.5, 0.5]]);
        await frame();
        check("dragging over the curves sets the time", Math.abs(clock() / slider.max - 0.5) < 0.1, clock());
    }
    if (isShown(map)) {
        const first = await seen(map);
        const other = await seen(map, () => { element("joint").selectedIndex = 1; element("joint").dispatchEvent(new Event("change")); });
        check("another joint has another map", other.hash !== first.hash, "the same pixels");
    }
} catch (error) {
    check("the page runs", false, error.stack);
}
return found;
})()
