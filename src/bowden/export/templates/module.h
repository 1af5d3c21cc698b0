/* [[module.title]]
 *
 * [[preamble]]
 */

#ifndef [[module.prefix|upper]]_H
#define [[module.prefix|upper]]_H

#include <stdbool.h>
#include <stdint.h>

typedef [[unit.real]] [[module.prefix]]_real;

{% for part in parts if part %}
[[part]]

{% endfor %}
#ifdef __cplusplus
extern "C" {
#endif

{% for public in functions %}
[[public.comment]]
[[public.head]];

{% endfor %}
#ifdef __cplusplus
}
#endif

#endif
