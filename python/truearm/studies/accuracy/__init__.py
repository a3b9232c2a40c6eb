"""The comparison of methods: the same measurements, splits and budget for all of them.

`sets` names arms and data, `splits` says which rows are held out, `cells` which questions are asked,
`methods` holds the methods, `running` runs and keeps what is done, `summary`, `page` and `pictures` tell it.
"""
