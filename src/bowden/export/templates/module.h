[[head]]

#ifndef [[prefix|upper]]_H
#define [[prefix|upper]]_H

#include <stdbool.h>
#include <stdint.h>

typedef [[real]] [[prefix]]_real;

{% for part in parts if part %}
[[part]]

{% endfor %}
#ifdef __cplusplus
extern "C" {
#endif

{% for public in functions %}
/* [[public.summary]] */
[[public.head]];

{% endfor %}
#ifdef __cplusplus
}
#endif

#endif
