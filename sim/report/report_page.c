#include <cjson/cJSON.h>
#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "sim/report/report.h"
#include "view/page_modules.h"

static const char style[] =
    "*{box-sizing:border-box}html{color-scheme:light dark}\n"
    "body{margin:0 auto;max-width:1160px;padding:1.2rem 1.2rem 3rem;background:var(--paper);"
    "color:var(--ink);font:15px/1.5 system-ui,-apple-system,\"Segoe UI\",Roboto,sans-serif}\n"
    "h1{font-size:1.7rem;line-height:1.2;margin:.2rem 0}h2{font-size:1.3rem;margin:2.2rem 0 .6rem;"
    "padding-bottom:.2rem;border-bottom:1px solid var(--grid)}h3{font-size:1.05rem;"
    "margin:1.6rem 0 .4rem}\n"
    "p{margin:.4rem 0}.sub,figcaption,.note{color:var(--soft)}.badge{display:inline-block;"
    "padding:.05rem .6rem;border-radius:1rem;border:1px solid currentColor;font-size:.85rem}\n"
    ".good{color:var(--k2)}.bad{color:var(--k3)}.fair{color:var(--k1)}\n"
    "ul.warnings{list-style:none;margin:0;padding:0}ul.warnings li{margin:.35rem 0;"
    "padding:.4rem .7rem;background:var(--panel);border-left:5px solid var(--k7)}\n"
    "ul.warnings li.bad{border-color:var(--k3)}ul.warnings li.fair{border-color:var(--k1)}\n"
    "ul.warnings li{color:var(--ink)}ul.warnings b{margin-right:.4em}\n"
    ".cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(8.6rem,1fr));gap:.6rem;"
    "margin:.6rem 0}.card{padding:.6rem .8rem;background:var(--panel);"
    "border:1px solid var(--grid);border-radius:.4rem}\n"
    ".card b{display:block;font-size:1.45rem;line-height:1.25;font-weight:600}"
    ".card small{color:var(--soft);display:block;line-height:1.3}.card b small{display:inline;"
    "font-size:.85rem;font-weight:400}\n"
    "figure{margin:.7rem 0;min-width:0;break-inside:avoid}.wide{overflow-x:auto}"
    ".wide .chart{min-width:42rem}\n"
    ".halves,.thirds{display:grid;gap:0 1.4rem;"
    "grid-template-columns:repeat(auto-fill,minmax(min(100%,30rem),1fr))}"
    ".thirds{grid-template-columns:repeat(auto-fill,minmax(min(100%,20rem),1fr))}\n"
    "figcaption{font-size:.88rem;margin-top:.15rem}\n"
    ".scroll{overflow-x:auto}table{border-collapse:collapse;font-size:.9rem;margin:.4rem 0}"
    "th,td{text-align:left;vertical-align:top;padding:.22rem .9rem .22rem 0;"
    "border-bottom:1px solid var(--grid)}th{font-weight:600}td.n,th.n{text-align:right;"
    "font-variant-numeric:tabular-nums}td.n,.w{white-space:nowrap}table.two "
    "th{font-weight:400;color:var(--soft);"
    "white-space:nowrap}\n"
    "details>summary{cursor:pointer;margin:.4rem 0}\n"
    ".plot{display:block;width:100%;touch-action:pan-y}.wide .plot{min-width:42rem}"
    ".plot:focus-visible,.scroll:focus-visible,.legend button:focus-visible,.readout "
    "button:focus-visible"
    "{outline:2px solid var(--k0);outline-offset:1px}\n"
    ".readout{position:relative;min-height:1.3rem;margin:-.3rem 0 0;font-size:.85rem;"
    "font-variant-numeric:tabular-nums}.readout button{position:absolute;right:0;top:-.4rem}\n"
    ".readout button,.legend button{font:inherit;color:inherit;background:none;cursor:pointer;"
    "border:1px solid transparent;border-radius:.3rem;padding:.1em .4em;min-height:24px}"
    ".readout button{border-color:var(--line);background:var(--paper)}.legend button{margin:0 "
    "-.4em}"
    ".legend button:hover,.readout button:hover{border-color:var(--ink)}"
    ".legend [aria-pressed=false]{text-decoration:line-through;color:var(--soft)}"
    ".legend b{display:inline-block;min-width:4.6em;margin-left:.5em;font-weight:600;"
    "font-variant-numeric:tabular-nums}\n"
    "@media screen{.answers>.chart{display:none}.answers ~ .legend{gap:0 1.4em}}\n"
    "@media print{.plot,.readout,.legend b{display:none}.legend button{border:0;padding:0;"
    "margin:0;min-height:0;text-decoration:none!important}}\n"
    ".frame{display:block;width:100%;height:auto}.frame image{image-rendering:pixelated}"
    ".frame text{font:12px system-ui,sans-serif}"
    ".frame text:not(.m){fill:var(--ink)}.frame .m{font:10px "
    "system-ui,sans-serif;paint-order:stroke;stroke:#000;stroke-width:2.5px;"
    "stroke-linejoin:round}\n"
    "@media print{body{max-width:none;padding:0;font-size:11px}.wide .chart{min-width:0}"
    "h2,h3{break-after:avoid}tr,.card,li{break-inside:avoid}"
    ".halves{grid-template-columns:1fr 1fr}.thirds{grid-template-columns:1fr 1fr 1fr}}\n";

bst_status bst_report_page_nonce(bst_ctx *ctx, const cJSON *manifest, const char *title,
                                 char nonce[BST_SHA256_TEXT]) {
    char *text = manifest ? cJSON_PrintUnformatted(manifest) : NULL, both[2 * BST_SHA256_TEXT];
    if (manifest && !text) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the report");
    }
    bst_sha256_text(title, strlen(title), both);
    bst_sha256_text(text ? text : "", text ? strlen(text) : 0, both + BST_SHA256_TEXT - 1);
    bst_sha256_text(both, 2 * BST_SHA256_TEXT - 2, nonce);
    free(text);
    return BST_OK;
}

void bst_report_page_begin(FILE *out, const char *title, const char *nonce) {
    fputs("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n", out);
    bst_view_page_write_policy(out, nonce);
    fputs(
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n"
        "<meta name=\"color-scheme\" content=\"light dark\"/>\n<title>",
        out);
    bst_html_text(out, title);
    fprintf(out, "</title>\n<style nonce=\"%s\">\n", nonce);
    fputs(style, out);
    bst_chart_style(out);
    fputs("</style>\n</head>\n<body>\n<main>\n<h1>", out);
    bst_html_text(out, title);
    fputs("</h1>\n", out);
}

bst_status bst_report_page_end(bst_ctx *ctx, FILE *out, const char *nonce) {
    static const char *const modules[] = {"chart.js", "report_charts.js", NULL};
    fputs("</main>\n", out);
    BST_TRY(bst_view_page_write_modules(ctx, out, nonce, modules));
    bst_view_page_write_start(out, nonce, "report_charts.js");
    fputs("</body>\n</html>\n", out);
    return BST_OK;
}

/* Writes text in which numbers such as 1.6e-05 are not broken at the hyphen. */
static void put_prose(FILE *out, const char *text) {
    while (*text) {
        size_t space = strspn(text, " "), word = strcspn(text + space, " ");
        const char *from = text + space;
        bool number = false;
        for (size_t i = 1; i + 2 < word && !number; i++) {
            number = from[i] == 'e' && from[i + 1] == '-' && isdigit((unsigned char)from[i - 1]) &&
                     isdigit((unsigned char)from[i + 2]);
        }
        fprintf(out, "%.*s%s", (int)space, text, number ? "<span class=\"w\">" : "");
        char part[400];
        for (size_t i = 0, n; i < word; i += n) {
            n = word - i < sizeof part - 1 ? word - i : sizeof part - 1;
            while (n < word - i && n > 1 && ((unsigned char)from[i + n] & 0xC0) == 0x80) {
                n--; /* do not cut inside a character */
            }
            memcpy(part, from + i, n);
            part[n] = '\0';
            bst_html_text(out, part);
        }
        fputs(number ? "</span>" : "", out);
        text = from + word;
    }
}

void bst_report_page_section(FILE *out, int level, const char *heading) {
    fprintf(out, "<section>\n<h%d>", level);
    bst_html_text(out, heading);
    fprintf(out, "</h%d>\n", level);
}

void bst_report_page_section_end(FILE *out) {
    fputs("</section>\n", out);
}

void bst_report_page_grid(FILE *out, bst_page_width width) {
    static const char *const classes[] = {
        [BST_PAGE_WIDE] = "", [BST_PAGE_HALF] = "halves", [BST_PAGE_THIRD] = "thirds"};
    fprintf(out, "<div class=\"%s\">\n", classes[width]);
}

void bst_report_page_grid_end(FILE *out) {
    fputs("</div>\n", out);
}

void bst_report_page_figure(FILE *out, bst_page_width width) {
    fputs(width == BST_PAGE_WIDE ? "<figure class=\"wide\">\n" : "<figure>\n", out);
}

void bst_report_page_figure_end(FILE *out, const char *caption) {
    fputs("<figcaption>", out);
    put_prose(out, caption);
    fputs("</figcaption>\n</figure>\n", out);
}

void bst_report_page_card(FILE *out, const char *value, const char *unit, const char *name,
                          const char *note) {
    fputs("<div class=\"card\"><small>", out);
    bst_html_text(out, name);
    fputs("</small><b>", out);
    put_prose(out, value);
    if (unit[0]) {
        fputs(" <small>", out);
        bst_html_text(out, unit);
        fputs("</small>", out);
    }
    fputs("</b>", out);
    if (note[0]) {
        fputs("<small>", out);
        put_prose(out, note);
        fputs("</small>", out);
    }
    fputs("</div>\n", out);
}

void bst_report_page_row(FILE *out, const char *name, const char *format, ...) {
    char text[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    fputs("<tr><th scope=\"row\">", out);
    bst_html_text(out, name);
    fputs("</th><td>", out);
    put_prose(out, text[0] ? text : "-");
    fputs("</td></tr>\n", out);
}

const char *bst_report_page_number(char text[32], double value, int digits) {
    if (!isfinite(value)) {
        return strcpy(text, "-");
    }
    /* no exponent for numbers of moderate size */
    double size = fabs(value);
    if (size >= 1e-3 && size < 1e6) {
        int after = digits - 1 - (int)floor(log10(size));
        snprintf(text, 32, "%.*f", after > 0 ? after : 0, value);
    } else {
        snprintf(text, 32, "%.*g", digits, value);
    }
    return text;
}

void bst_report_warnings_add(bst_report_warnings *w, bst_run_severity severity, const char *format,
                             ...) {
    if (w->count == BST_REPORT_WARNINGS) {
        w->more++;
        return;
    }
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(w->items[w->count].text, sizeof w->items->text, format, arguments);
    va_end(arguments);
    w->items[w->count++].severity = severity;
}

void bst_report_warnings_write(FILE *out, const bst_report_warnings *w) {
    static const char *const classes[] = {"bad", "fair", "note"}, *const words[] = {
                                                                      "Problem", "Warning", "Note"};
    bst_report_page_section(out, 2, "Warnings");
    if (w->count == 0) {
        fputs("<p class=\"good\">Nothing to warn of.</p>\n", out);
    } else {
        fputs("<ul class=\"warnings\">\n", out);
        for (int severity = BST_SEVERITY_PROBLEM; severity <= BST_SEVERITY_NOTE; severity++) {
            for (int i = 0; i < w->count; i++) {
                if ((int)w->items[i].severity == severity) {
                    fprintf(out, "<li class=\"%s\"><b>%s:</b>", classes[severity], words[severity]);
                    put_prose(out, w->items[i].text);
                    fputs("</li>\n", out);
                }
            }
        }
        fputs("</ul>\n", out);
    }
    if (w->more > 0) {
        fprintf(out, "<p>%d more are not listed.</p>\n", w->more);
    }
    bst_report_page_section_end(out);
}
