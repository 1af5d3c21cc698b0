[[head]]

#ifndef [[guard]]
#define [[guard]]

#include <stdbool.h>
#include <stdint.h>

typedef [[real]] [[prefix]]_real;

{% for part in parts if part %}
[[part]]

{% endfor %}
#ifdef __cplusplus
extern "C" {
#endif

{% for prototype in prototypes %}
[[prototype]];

{% endfor %}
#ifdef __cplusplus
}
#endif

#endif
