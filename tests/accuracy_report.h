/* accuracy_report.h - out of what was measured: CSV files, plots by gnuplot, and a page that holds all of it. Part of accuracy.c.

   >>files  >>hit-plots  >>image-plots  >>tables  >>page                                SPDX-License-Identifier: MIT OR Unlicense */

/* All that a report tells; what is NULL or 0 was not measured. */
typedef struct {
    const image_study *images;
    const refine_study *refining;
    const way_times *times;
    const leave_result *leaving;
    size_t leaving_count;
    const char *device;
    double seconds;                         /* that all of it took, */
    int threads;
} report;

/* ---- >>files -------------------------------------------------------------------------------------------------------- */

/* Files are written under other names, and all renamed at the end: an interrupted run leaves those that were there. */
static const char *const report_files[] = { "accuracy.csv", "images.csv", "hits.svg", "samples.svg", "seconds.svg", "refining.svg", "report.html" };

static const char *report_path(const char *folder, const char *name, bool part)
{
    static char paths[4][4096];
    static int turn;
    char *path = paths[turn++ % 4];

    snprintf(path, sizeof *paths, "%s/%s%s", folder, name, part ? ".part" : "");
    return path;
}

static void report_drop(const char *folder)
{
    size_t i;

    for (i = 0; i < COUNT(report_files); i++) remove(report_path(folder, report_files[i], true));
}

static bool report_keep(const char *folder)
{
    size_t i;

    for (i = 0; i < COUNT(report_files); i++) {
        const char *part = report_path(folder, report_files[i], true), *path = report_path(folder, report_files[i], false);

        if (access(part, F_OK) == 0 && rename(part, path) != 0) return complain("%s: %s", path, strerror(errno));
    }
    return true;
}

static FILE *report_open(const char *folder, const char *name)
{
    const char *path = report_path(folder, name, true);
    FILE *file = fopen(path, "w");

    if (!file) complain("%s: %s", path, strerror(errno));
    return file;
}

static bool report_close(FILE *file, const char *name)
{
    const bool good = !ferror(file);

    return (fclose(file) == 0 && good) || complain("%s: %s", name, strerror(errno));
}

/* Whether a report can be made there: asked before all that is measured. */
static bool report_possible(const char *folder)
{
    struct stat info;
    size_t i;

    if (stat(folder, &info) != 0) return complain("%s: %s", folder, strerror(errno));
    if (!S_ISDIR(info.st_mode)) return complain("%s: is not a folder", folder);
    if (strlen(folder) > 3000) return complain("%s: is too long", folder);
    for (i = 0; i < COUNT(report_files); i++) {
        FILE *file = report_open(folder, report_files[i]);

        if (!file) return false;
        fclose(file);
        remove(report_path(folder, report_files[i], true));
    }
    return system("gnuplot --version >/dev/null 2>&1") == 0 || complain("gnuplot, which draws the plots, is not installed (Debian: gnuplot-nox)");
}

/* A plot of width x height: commands and data follow, then plot_end. */
static FILE *plot_begin(const char *folder, const char *name, int width, int height)
{
    FILE *plot = popen("gnuplot", "w");

    if (!plot) {
        complain("gnuplot: %s", strerror(errno));
        return NULL;
    }
    fprintf(plot, "set terminal svg size %d,%d dynamic font 'sans-serif,12' background '#ffffff'\nset output '%s'\n"
            "set grid back lc rgb '#dddddd' lt 1 lw 0.5\nset border lc rgb '#888888'\nset tics textcolor rgb '#333333'\nset key reverse Left samplen 1.5\n"
            "set logscale xy\n", width, height, report_path(folder, name, true));
    return plot;
}

static bool plot_end(FILE *plot) { return pclose(plot) == 0 || complain("gnuplot fails"); }

/* ---- >>hit-plots ---------------------------------------------------------------------------------------------------- */

/* A way over all suites that peers could be measured on too. */
typedef struct { const way *w; size_t rays, missed, false_hits, wrong, excused, compared; double t_sum, t_most, part_most, uv_most, ns_sum, ns_count, log_sum,
                 log_count; bool same; } sum_row;

/* Was every way timed there? Only such suites count where times are compared. */
static bool suite_is_timed(const char *title)
{
    size_t i;

    for (i = 0; i < row_count; i++)
        if (!(rows[i].ns > 0) && strcmp(rows[i].suite, title) == 0) return false;
    return true;
}

static bool suite_has_peer(const char *title)
{
    size_t i;

    for (i = 0; i < row_count; i++)
        if (rows[i].w->kind == PEER && strcmp(rows[i].suite, title) == 0) return true;
    return false;
}

/* Sums by way, in the order of ways. */
static sum_row *sum_rows(void)
{
    sum_row *sums = need(way_count, sizeof *sums);
    const char *last = "";
    bool counts = false, timed = false;
    size_t i;

    for (i = 0; i < way_count; i++) sums[i].w = &ways[i], sums[i].same = true;
    for (i = 0; i < row_count; i++) {
        const row *r = &rows[i];
        sum_row *to = &sums[r->w - ways];

        if (strcmp(last, r->suite) != 0) counts = suite_has_peer(r->suite), timed = suite_is_timed(r->suite);
        last = r->suite;
        if (!counts) continue;
        to->rays += r->s.rays, to->missed += r->s.missed, to->false_hits += r->s.false_hits, to->wrong += r->s.wrong;
        to->excused += r->s.excused, to->compared += r->s.compared;
        to->t_sum += r->s.t.ulp_sum, to->t_most = fmax(to->t_most, r->s.t.ulp_most), to->part_most = fmax(to->part_most, r->s.t.part_most);
        to->uv_most = fmax(to->uv_most, r->s.uv.most);
        to->same = to->same && r->same;
        if (timed) to->ns_sum += log(r->ns), to->ns_count++;
        if (r->s.compared) to->log_sum += log(mean(r->s.t.ulp_sum, r->s.compared) + 1e-3), to->log_count++;
    }
    return sums;
}

static double sum_ns(const sum_row *r) { return r->ns_count > 0 ? exp(r->ns_sum / r->ns_count) : 0; }
static double of_a_million(size_t bad, size_t rays) { return 1e6 * (double)bad / (double)rays; }

static double sum_rate(const sum_row *r) { return of_a_million(r->missed + r->false_hits + r->wrong, r->rays); }

/* What a point is drawn as. */
static const char *const hit_groups[] = { "bvh", "kdtree", "threaded", "device", "Moeller-Trumbore", "Embree", "Embree robust" };

static int group_of(const way *w)
{
    if (w->kind == DEVICE) return 3;
    if (w->kind == OURS) return (int)w->structure;
    return strstr(w->name, "robust") ? 6 : strstr(w->name, "Embree") ? 5 : 4;
}

static bool plot_hits(const char *folder, const sum_row *sums)
{
    const double floor_rate = 0.01;         /* where none stands on a logarithmic axis */
    FILE *plot = plot_begin(folder, "hits.svg", 960, 400);
    double least = 50, most = 1000;
    size_t group, i;
    int panel;

    if (!plot) return false;
    for (i = 0; i < way_count; i++)
        if (sums[i].ns_count > 0) least = fmin(least, sum_ns(&sums[i])), most = fmax(most, sum_ns(&sums[i]));
    for (group = 0; group < COUNT(hit_groups); group++) {
        fprintf(plot, "$g%zu << EOD\n", group);
        for (i = 0; i < way_count; i++)
            if (sums[i].ns_count > 0 && group_of(sums[i].w) == (int)group)
                fprintf(plot, "%g %g %g\n", sum_ns(&sums[i]), fmax(sum_rate(&sums[i]), floor_rate),
                        exp(sums[i].log_sum / fmax(sums[i].log_count, 1)));
        fprintf(plot, "1e-30 1e-30 1e-30\nEOD\n");          /* beyond the axes: a group may be empty */
    }
    fprintf(plot, "set multiplot layout 1,2\nset xlabel 'nanoseconds a ray, one thread'\nset xrange [%g:%g]\n", least / 1.2, most * 1.2);
    for (panel = 0; panel < 2; panel++) {
        if (panel) fputs("set title 'error of t: mean of a suite, geometric mean over suites'\nset ylabel 'units in the last place'\nset yrange [0.1:100]\nset ytics auto\nset format y '%g'\nunset key\n", plot);
        else fprintf(plot, "set title 'missed, false and wrong hits'\nset ylabel 'of a million rays'\nset yrange [%g:1e6]\nset format y '%%g'\n"
                           "set ytics ('none' %g, '0.1' 0.1, '1' 1, '10' 10, '100' 100, '1000' 1e3, '10 000' 1e4, '100 000' 1e5)\nset key center right\n",
                     floor_rate / 2, floor_rate);
        fputs("plot ", plot);
        for (group = 0; group < COUNT(hit_groups); group++) {
            static const char *const looks[] = { "pt 7 ps 0.5 lc rgb '#1f77b4'", "pt 5 ps 0.5 lc rgb '#2ca02c'", "pt 9 ps 0.6 lc rgb '#9467bd'",
                                                 "pt 6 ps 0.6 lc rgb '#555555'", "pt 2 ps 1.2 lw 2 lc rgb '#d62728'", "pt 1 ps 1.4 lw 2 lc rgb '#ff7f0e'",
                                                 "pt 3 ps 1.2 lw 2 lc rgb '#8c564b'" };
            fprintf(plot, "%s$g%zu using 1:%d with points %s title '%s%s'", group ? ", " : "", group, 2 + panel, looks[group],
                    group < 4 ? "rt.h, " : "", hit_groups[group]);
        }
        fputc('\n', plot);
    }
    return plot_end(plot);
}

/* ---- >>image-plots -------------------------------------------------------------------------------------------------- */

static const char *const sampler_colors[RT_SAMPLER_COUNT] = { "#000000", "#d62728", "#2ca02c", "#1f77b4" };
static const char *const refine_colors[REFINE_KINDS] = { "#888888", "#1f77b4", "#d62728" };

/* A panel a scene: errors against samples, or seconds. */
static bool plot_convergence(const char *folder, const image_study *study, bool seconds)
{
    FILE *plot = plot_begin(folder, seconds ? "seconds.svg" : "samples.svg", 960, 560);
    int which, level;
    size_t n;

    if (!plot) return false;
    fprintf(plot, "set multiplot layout 2,3\nset xlabel '%s'\nset format y '%%g'\nset format x '%%g'\n",
            seconds ? "seconds of one thread" : "samples a pixel");
    if (!seconds) fprintf(plot, "set xtics (1,4,16,64,256,1024)\nset xrange [0.8:%g]\n", 1.25 * (1 << (study->levels - 1)));
    for (n = 0; n < STAGES; n++) {
        for (which = RT_SAMPLER_INDEPENDENT; which < RT_SAMPLER_COUNT; which++) {
            fprintf(plot, "$s%d << EOD\n", which);
            for (level = 0; level < study->levels; level++) {
                const image_point *p = &study->points[n][which][level];
                fprintf(plot, "%g %g\n", seconds ? p->seconds : (double)(1 << level), p->rmse);
            }
            fputs("EOD\n", plot);
        }
        fprintf(plot, "set title '%s'\nset ylabel '%s'\n%s\nplot ", stage_kinds[n].name, n % 3 ? "" : "root mean square error",
                n ? "unset key" : "set key bottom left font ',9' spacing 0.8");
        for (which = RT_SAMPLER_INDEPENDENT; which < RT_SAMPLER_COUNT; which++)
            fprintf(plot, "$s%d with linespoints pt 7 ps 0.35 lw 1.5 lc rgb '%s' title '%s', ", which, sampler_colors[which], sampler_names[which]);
        fputs("0.01 with lines dt 3 lc rgb '#000000' notitle\n", plot);
    }
    return plot_end(plot);
}

static bool plot_refining(const char *folder, const refine_study *study)
{
    FILE *plot = plot_begin(folder, "refining.svg", 960, 560);
    int which, i;
    size_t n;

    if (!plot) return false;
    fputs("set multiplot layout 2,3\nset xlabel 'seconds of one thread'\nset format y '%g'\nset format x '%g'\n", plot);
    for (n = 0; n < STAGES; n++) {
        for (which = 0; which < REFINE_KINDS; which++) {
            fprintf(plot, "$r%d << EOD\n", which);
            for (i = 0; i < study->counts[n][which]; i++) {
                const refine_point *p = &study->points[n][which][i];
                fprintf(plot, "%g %g %g\n", p->seconds, p->rmse, which == ONE_SEQUENCE ? p->rmse : p->estimate);
            }
            fputs("EOD\n", plot);
        }
        fprintf(plot, "set title '%s'\nset ylabel '%s'\n%s\nplot ", stage_kinds[n].name, n % 3 ? "" : "root mean square error",
                n ? "unset key" : "set key bottom left font ',9' spacing 0.8");
        for (which = 0; which < REFINE_KINDS; which++)
            fprintf(plot, "$r%d using 1:2 with linespoints pt 7 ps 0.35 lw 1.5 lc rgb '%s' title '%s', ", which, refine_colors[which], refine_names[which]);
        fprintf(plot, "$r%d using 1:3 with points pt 6 ps 0.8 lc rgb '#000000' title 'estimated', $r%d using 1:3 with points pt 6 ps 0.8 lc rgb "
                "'#000000' notitle\n", UNIFORM, ADAPTIVE);
    }
    return plot_end(plot);
}

static bool write_images(const char *folder, const report *r)
{
    FILE *csv = report_open(folder, "images.csv");
    int which, i;
    size_t n;

    if (!csv) return false;
    fputs("scene,kind,spp,seconds,rmse,relmse,estimate\n", csv);
    for (n = 0; n < STAGES; n++) {
        for (which = RT_SAMPLER_INDEPENDENT; which < RT_SAMPLER_COUNT; which++)
            for (i = 0; i < r->images->levels; i++) {
                const image_point *p = &r->images->points[n][which][i];
                fprintf(csv, "%s,%s,%d,%.6g,%.6g,%.6g,\n", stage_kinds[n].name, sampler_names[which], 1 << i, p->seconds, p->rmse, p->relmse);
            }
        for (which = 0; which < REFINE_KINDS; which++)
            for (i = 0; i < r->refining->counts[n][which]; i++) {
                const refine_point *p = &r->refining->points[n][which][i];
                fprintf(csv, "%s,%s,%.6g,%.6g,%.6g,,", stage_kinds[n].name, refine_names[which], p->samples, p->seconds, p->rmse);
                if (which != ONE_SEQUENCE) fprintf(csv, "%.6g", p->estimate);
                fputc('\n', csv);
            }
        for (which = 0; which < PICTURE_WAYS; which++)
            if (r->times->seconds[n][which] > 0)
                fprintf(csv, "%s,%s,%d,%.6g,%.6g,,\n", stage_kinds[n].name, picture_ways[which].name, 1 << WAY_LEVEL, r->times->seconds[n][which],
                        r->images->points[n][RT_SAMPLER_SOBOL][WAY_LEVEL].rmse);
    }
    return report_close(csv, "images.csv");
}

/* ---- >>tables ------------------------------------------------------------------------------------------------------- */

static void put_text(FILE *html, const char *text)
{
    for (; *text; text++) {
        if (*text == '<') fputs("&lt;", html);
        else if (*text == '>') fputs("&gt;", html);
        else if (*text == '&') fputs("&amp;", html);
        else fputc(*text, html);
    }
}

/* Cells of a row, told apart by |. */
static void put_row(FILE *html, const char *cell, const char *format, ...)
{
    char text[1024], *at = text, *next;
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    fputs("<tr>", html);
    for (; at; at = next) {
        if ((next = strchr(at, '|')) != NULL) *next++ = '\0';
        fprintf(html, "<%s>", cell);
        put_text(html, at);
        fprintf(html, "</%s>", cell);
    }
    fputs("</tr>\n", html);
}

/* The plot as a picture within the page. */
static bool put_plot(FILE *html, const char *folder, const char *name, const char *what)
{
    const char *path = report_path(folder, name, true);
    FILE *svg = fopen(path, "r");
    int c;

    if (!svg) return complain("%s: %s", path, strerror(errno));
    fprintf(html, "<img alt=\"%s\" src=\"data:image/svg+xml,", what);
    while ((c = fgetc(svg)) != EOF) {
        if (c == '"' || c == '#' || c == '%' || c == '<' || c == '>' || c == '&' || c < ' ') fprintf(html, "%%%02X", (unsigned)c);
        else fputc(c, html);
    }
    fputs("\">\n", html);
    fclose(svg);
    return true;
}

static void put_hits(FILE *html, const sum_row *sums)
{
    size_t i;

    fputs("<table>\n", html);
    put_row(html, "th", "way|rays|missed|false|wrong|within rounding|t: ulp, mean|at most|t: relative, at most|u, v: at most|same bits|ns a ray");
    for (i = 0; i < way_count; i++) {
        const sum_row *r = &sums[i];

        if (!r->rays) continue;
        put_row(html, "td", "%s|%zu|%zu|%zu|%zu|%zu|%.3f|%.4g|%.3g|%.3g|%s|%.1f", r->w->name, r->rays, r->missed, r->false_hits, r->wrong, r->excused,
                mean(r->t_sum, r->compared), r->t_most, r->part_most, r->uv_most, r->w->kind == PEER ? "-" : r->same ? "yes" : "NO", sum_ns(r));
    }
    fputs("</table>\n", html);
}

static void put_suites(FILE *html)
{
    size_t i, k;

    fputs("<table>\n<tr><th>suite</th><th>places</th><th>rays</th><th>hits</th><th>rt.h: missed</th><th>false</th><th>wrong</th><th>ways</th>"
          "<th>that differ</th><th>t: ulp, mean</th><th>at most</th><th>u, v: at most</th>", html);
    for (k = 0; k < way_count; k++)
        if (ways[k].kind == PEER) fprintf(html, "<th>%s: missed + false + wrong, of a million</th>", ways[k].name);
    fputs("</tr>\n", html);
    for (i = 0; i < total_count; i++) {
        const total *t = &totals[i];
        char others[PEERS * 24] = "";
        size_t length = 0, peer = 0;

        for (k = 0; k < way_count; k++) {
            const score *p = &t->peers[peer];

            if (ways[k].kind != PEER) continue;
            if (p->rays) length += (size_t)snprintf(others + length, sizeof others - length, "|%.0f",
                                                    of_a_million(p->missed + p->false_hits + p->wrong, p->rays));
            else length += (size_t)snprintf(others + length, sizeof others - length, "|-");
            peer++;
        }
        put_row(html, "td", "%s|%zu|%zu|%zu|%zu|%zu|%zu|%zu|%zu|%.3g|%.3g|%.2g%s", t->suite, t->places, t->ours.rays, t->ours.hits, t->ours.missed,
                t->ours.false_hits, t->ours.wrong, t->ways, t->differ, mean(t->ours.t.ulp_sum, t->ours.compared), t->ours.t.ulp_most,
                t->ours.uv.most, others);
    }
    fputs("</table>\n", html);
}

static void put_leaving(FILE *html, const report *r)
{
    size_t i;

    fputs("<table>\n", html);
    put_row(html, "th", "origins|rays|wrong|ns an origin");
    for (i = 0; i < r->leaving_count; i++)
        put_row(html, "td", r->leaving[i].ns > 0 ? "%s|%llu|%llu|%.1f" : "%s|%llu|%llu|", r->leaving[i].name, (unsigned long long)r->leaving[i].rays,
                (unsigned long long)r->leaving[i].wrong, r->leaving[i].ns);
    fputs("</table>\n", html);
}

/* Slopes, and what equal errors and equal times come to. */
static void put_convergence(FILE *html, const image_study *study)
{
    const int last = study->levels - 1;
    size_t n;
    int which;

    fputs("<table>\n", html);
    put_row(html, "th", "scene|sampler|slope|error at 1|at 64|at %d|relative at %d|samples to 0.01|seconds to 0.01|seconds to the error of independent at %d|"
            "times less|error in the time of independent at 64", 1 << last, 1 << last, 1 << last);
    for (n = 0; n < STAGES; n++)
        for (which = RT_SAMPLER_INDEPENDENT; which < RT_SAMPLER_COUNT; which++) {
            const image_point *p = study->points[n][which], *plain = study->points[n][RT_SAMPLER_INDEPENDENT];
            const double seconds = seconds_to(p, study->levels, plain[last].rmse, false);

            put_row(html, "td", "%s|%s|%.3f|%.4f|%.5f|%.6f|%.3g|%.1f|%.4f|%.3f|%.2f|%.5f", stage_kinds[n].name, sampler_names[which], study->slopes[n][which],
                    p[0].rmse, p[6 < last ? 6 : last].rmse, p[last].rmse, p[last].relmse, seconds_to(p, study->levels, 0.01, true),
                    seconds_to(p, study->levels, 0.01, false), seconds, plain[last].seconds / seconds, error_after(p, study->levels, plain[6 < last ? 6 : last].seconds));
        }
    fputs("</table>\n", html);
}

static void put_times(FILE *html, const report *r)
{
    size_t n;
    int tracer;

    fputs("<table>\n<tr><th>seconds to an error of 0.01</th>", html);
    for (n = 0; n < STAGES; n++) fprintf(html, "<th>%s</th>", stage_kinds[n].name);
    fputs("</tr>\n", html);
    for (tracer = 0; tracer < PICTURE_WAYS; tracer++) {
        if (!(r->times->seconds[0][tracer] > 0)) continue;
        fprintf(html, "<tr><td>%s</td>", picture_ways[tracer].name);
        for (n = 0; n < STAGES; n++)
            fprintf(html, "<td>%.4f</td>", r->times->seconds[n][tracer] / (1 << WAY_LEVEL) * seconds_to(r->images->points[n][RT_SAMPLER_SOBOL], r->images->levels, 0.01, true));
        fputs("</tr>\n", html);
    }
    fputs("</table>\n", html);
}

static void put_refining(FILE *html, const refine_study *study)
{
    size_t n;
    int which;

    fputs("<table>\n", html);
    put_row(html, "th", "scene|way|samples|seconds|error|estimated|adaptive: times less|possible, samples");
    for (n = 0; n < STAGES; n++)
        for (which = 0; which < REFINE_KINDS; which++) {
            const refine_point *p = &study->points[n][which][study->counts[n][which] - 1];
            char more[64] = "|", estimate[32] = "-";

            if (which == ADAPTIVE) snprintf(more, sizeof more, "%.2f|%.2f", study->gains[n], study->room[n]);
            if (which != ONE_SEQUENCE) snprintf(estimate, sizeof estimate, "%.6f", p->estimate);
            put_row(html, "td", "%s|%s|%.1f|%.3f|%.6f|%s|%s", stage_kinds[n].name, refine_names[which], p->samples, p->seconds, p->rmse, estimate, more);
        }
    fputs("</table>\n", html);
}

/* ---- >>page --------------------------------------------------------------------------------------------------------- */

static const char report_style[] =
    "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\"><title>rt.h: error against run time</title>\n"
    "<style>body{font:16px/1.5 sans-serif;max-width:1000px;margin:2em auto;padding:0 1em;color:#222}h1,h2{line-height:1.2}h2{margin-top:2em}\n"
    "table{border-collapse:collapse;font-size:13px;display:block;overflow-x:auto;margin:1em 0}th,td{padding:2px 8px;text-align:right;border-bottom:1px solid #ddd}\n"
    "th{background:#f4f4f4;vertical-align:bottom}th:first-child,td:first-child{text-align:left;white-space:nowrap}img{max-width:100%;height:auto}\n"
    "details{margin:1em 0}summary{cursor:pointer}</style></head><body>\n";

/* The name of the processor, where the system tells. */
static void processor_name(char *out, size_t size)
{
    char text[256];
    FILE *file = fopen("/proc/cpuinfo", "r");

    snprintf(out, size, "a processor");
    while (file && fgets(text, sizeof text, file)) {
        char *name = strncmp(text, "model name", 10) == 0 ? strchr(text, ':') : NULL;
        if (!name) continue;
        name[strcspn(name, "\n")] = '\0';
        snprintf(out, size, "%s", name + 2);
        break;
    }
    if (file) fclose(file);
}

static bool put_page(FILE *html, const char *folder, const report *r, const sum_row *sums)
{
    size_t i, rays = 0, missed = 0, false_hits = 0, wrong = 0, ways_ours = 0, differ = 0, best = 0, faster = 0;
    char processor[128];
    double bad_worst = 0;
    bool good;

    for (i = 0; i < total_count; i++) {
        rays += totals[i].ours.rays, missed += totals[i].ours.missed, false_hits += totals[i].ours.false_hits, wrong += totals[i].ours.wrong;
        differ += totals[i].differ;
    }
    for (i = 0; i < way_count; i++) ways_ours += ways[i].kind != PEER;
    for (i = 1; i < STAGES; i++)
        if (r->refining->room[i] > r->refining->room[best]) best = i;
    for (i = 0; i < STAGES; i++) {
        const image_point (*p)[LEVELS] = r->images->points[i];
        const int last = r->images->levels - 1;
        const double goal = p[RT_SAMPLER_INDEPENDENT][last].rmse;
        faster += p[RT_SAMPLER_INDEPENDENT][last].seconds >= 4 * seconds_to(p[RT_SAMPLER_SOBOL], r->images->levels, goal, false);
    }
    processor_name(processor, sizeof processor);
    fputs(report_style, html);
    fprintf(html, "<h1>rt.h: error against run time</h1>\n<p>%s, %s%s%s; compiler %s; %.0f minutes on %d threads.</p>\n", processor,
            isa_names[rt_best_isa()], r->device ? "; device: " : "", r->device ? r->device : "", __VERSION__, r->seconds / 60, r->threads);
    fprintf(html, "<p>Of %zu rays in %zu suites rt.h missed %zu hits, found %zu that are not there and %zu on a wrong primitive; of its %zu ways to trace, "
            "%zu differ from the first in a bit.</p>\n", rays, total_count, missed, false_hits, wrong, ways_ours, differ);

    fputs("<h2>Hits against the truth</h2>\n<p>The truth is found in exact arithmetic. A faster way should cost no accuracy: all points of rt.h lie "
          "at the same height, since their bits are the same. Only the suites of triangle meshes, which all can trace, are in this plot and table. "
          "<i>Within rounding</i> counts rays so near to an edge that 16 roundings of the farthest coordinate decide it.</p>\n", html);
    good = put_plot(html, folder, "hits.svg", "errors of hits against nanoseconds a ray");
    fputs("<details><summary>Each way</summary>\n", html);
    put_hits(html, sums);
    fputs("</details>\n<h2>Stiff and extreme suites</h2>\n<p>Each suite is a model with one kind of rays, at several scales and offsets where that says "
          "something. What rt.h misses, finds falsely or on the wrong primitive must be 0 everywhere; peers are counted the same way, on a "
          "quarter of the rays, where they have such primitives. t, u and v are as good as the problem is: along a surface that a ray grazes, or a sliver that it sees "
          "edge-on, a last bit of a vertex moves the place where they meet from one side of the triangle to the other.</p>\n", html);
    put_suites(html);
    for (i = 0; i < total_count; i++) bad_worst = fmax(bad_worst, totals[i].bad);
    if (bad_worst > 0)
        fprintf(html, "<p>Rays that are not finite, or go nowhere, miss; at worst they take %.2f times as long as others.</p>\n", bad_worst);
    fputs("<h2>Leaving a surface</h2>\n<p>Secondary rays from rt_spawn_origin meet neither the surface they leave nor pass a neighbour; "
          "the usual origins do.</p>\n", html);
    put_leaving(html, r);

    fprintf(html, "<h2>Pictures: error against samples and time</h2>\n<p>The root of the mean square error of pictures of %d x %d pixels against a reference of "
            "%d samples of another sampler, whose own error is taken off; mean of %d seeds. Independent samples fall as n<sup>-1/2</sup>; Sobol' points need "
            "at least 4 times less time to the error that %d independent ones reach in %zu of %d scenes.</p>\n", SMALL_WIDTH, SMALL_HEIGHT,
            16 << (r->images->levels - 1), SEEDS, 1 << (r->images->levels - 1), faster, (int)STAGES);
    good = good && put_plot(html, folder, "samples.svg", "errors of pictures against samples a pixel");
    good = good && put_plot(html, folder, "seconds.svg", "errors of pictures against seconds");
    put_convergence(html, r->images);
    fputs("<p>Who traces a picture's rays changes its time and not a bit of it: the same samples, so the same error.</p>\n", html);
    put_times(html, r);
    fprintf(html, "<h2>Pictures that tell their own error</h2>\n<p>As render --error does it, at %d x %d pixels: the mean of two halves with numbers of their own "
            "tells its error without a reference; of single pictures the estimate was %.2f to %.2f times the error. Adaptive sampling pays where noise is "
            "uneven: most in \"%s\", where it took %.2f times less time than uniform sampling to its last error.</p>\n", LARGE_WIDTH, LARGE_HEIGHT,
            r->refining->least, r->refining->most, stage_kinds[best].name, r->refining->gains[best]);
    good = good && put_plot(html, folder, "refining.svg", "errors of pictures that refine against seconds");
    put_refining(html, r->refining);
    fputs("</body></html>\n", html);
    return good;
}

/* All files, or none. */
static bool report_write(const char *folder, const report *r)
{
    sum_row *sums = sum_rows();
    FILE *html;
    bool good = write_rows(report_path(folder, "accuracy.csv", true)) && write_images(folder, r) && plot_hits(folder, sums) &&
                plot_convergence(folder, r->images, false) && plot_convergence(folder, r->images, true) && plot_refining(folder, r->refining);

    if (good && (html = report_open(folder, "report.html")) != NULL) {
        good = put_page(html, folder, r, sums);
        good = report_close(html, "report.html") && good;
    } else good = false;
    free(sums);
    if (good) return report_keep(folder);
    report_drop(folder);
    return false;
}
