"""Where marks are on the screen: measured in the pixels of the overlay of the viewer's page, weighted by their opacity."""

LOOK = """
    const view = document.boresight.frameView, { overlay } = view;
    for (const name of Object.keys(view.shown)) view.setShown(name, name === KIND);
    view.details.wcs = null; // no compass
    PREPARE
    view.drawOverlay();
    const ratio = devicePixelRatio || 1, data = overlay.getContext('2d').getImageData(0, 0, overlay.width, overlay.height).data;
    // middle of what is drawn in a box of pixels of the screen, in dots of the page; null: nothing is
    const centre = (left, top, right, bottom) => {
        let sum = 0, x = 0, y = 0;
        for (let j = Math.max(0, top); j < Math.min(overlay.height, bottom); j++) for (let i = Math.max(0, left); i < Math.min(overlay.width, right); i++) {
            const a = data[4 * (j * overlay.width + i) + 3];
            sum += a;
            x += a * (i + 0.5);
            y += a * (j + 0.5);
        }
        return sum > 0 ? [x / sum / ratio, y / sum / ratio] : null;
    };
"""


def script(kind, found, prepare=""):
    """JavaScript that draws the marks of one kind alone, and says what `found` makes of centre(left, top, right, bottom). `prepare`: what
    is done before they are drawn."""
    return "(() => {" + LOOK.replace("KIND", f"'{kind}'").replace("PREPARE", prepare) + found + "})()"
