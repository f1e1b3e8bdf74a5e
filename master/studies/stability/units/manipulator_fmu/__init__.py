"""The hydraulic manipulator of the Laboratorio de Ingenieria Mecanica, A Coruna: a two-link arm and its cylinder."""
