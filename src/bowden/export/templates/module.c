/* [[module.title]]
 *
 * [[preamble]]
 */

#include <math.h>

#include "[[module.prefix]].h"
{% for part in parts if part %}

[[part]]
{% endfor %}
{% for name, helper in unit.helpers.items() %}

{% if helper.length %}
/* the newest first, and what was there one place on */
static inline [[helper.type]] [[name]]([[helper.item]] newest, const [[helper.type]] *past)
{
    [[helper.type]] moved;

    moved.at[0] = newest;
    for (int i = 1; i < [[helper.length]]; ++i) {
        moved.at[i] = past->at[i - 1];
    }
    return moved;
}
{% else %}
static inline [[helper.type]] [[name]](const [[helper.type]] a, const [[helper.type]] b)
{
    return b [[helper.sign]] a ? b : a;
}
{% endif %}
{% endfor %}
{% for part in unit.functions.values() %}

[[part]]
{% endfor %}
{% for public in functions %}

[[public.comment]]
[[public.head]]
{
[[public.body]]
}
{% endfor %}
